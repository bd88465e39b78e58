"""Declare materials, laws, supports, loads and contacts: data and UFL, no mesh."""
