"""What a release says of itself is said once, or is the same in all places.

- Citation, recipe and changelog have the version of pyproject.toml.
- The recipe for conda asks for what the package asks for, with the same bounds.
- The README of PyPI has no link and no picture that needs a clone.
"""

import importlib.util
import re
import tomllib

import pytest
from processes import ROOT

import erc_contact as ec
from erc_contact.base.versions import versions

pytestmark = pytest.mark.serial
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
RECIPE = (ROOT / "packaging" / "conda" / "recipe.yaml").read_text()
OTHER_NAMES = {"gmsh": "python-gmsh", "matplotlib": "matplotlib-base"}
"""Names of packages that conda-forge calls in another way."""


def test_version_is_the_same_everywhere():
    version = PROJECT["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()
    assert f'\n  version: "{version}"\n' in RECIPE
    releases = re.findall(r"^## \[(\d.*?)\]", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert releases[0] == version
    assert releases == sorted(releases, reverse=True)
    assert ec.__version__ == versions()["erc_contact"]


def test_recipe_asks_for_what_the_package_asks_for():
    asked = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["pictures"]]
    for requirement in asked:
        name, least = requirement.split(">=")
        assert f"    - {OTHER_NAMES.get(name, name)} >={least}\n" in RECIPE
    assert f'  python_min: "{PROJECT["requires-python"].removeprefix(">=")}"\n' in RECIPE


def test_readme_of_pypi_needs_no_clone():
    place = ROOT / "packaging" / "readme.py"
    spec = importlib.util.spec_from_file_location("readme", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    text = (ROOT / "README.md").read_text()
    relative = re.compile(r"\]\((?!https?://)")
    assert relative.search(text)
    source = "https://example.org/erc_contact"
    for address in (None, source):
        assert not relative.search(module.with_addresses(text, address))
    linked = module.with_addresses(text, source)
    assert f"]({source}/blob/main/docs/first_steps.md)" in linked
    assert f"]({source}/raw/main/docs/figures/block.png)" in linked
    assert "First steps is a tutorial" in module.with_addresses(text, None)
