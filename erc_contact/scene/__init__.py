"""What is declared: materials, friction laws, supports, loads and contacts. Data and UFL, no mesh."""
