"""The package's names: all there, none hidden by a module, nothing heavy before they are used."""

import pkgutil
import subprocess
import sys

import pytest

from utank_hil import analysis


@pytest.mark.parametrize("name", analysis.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert callable(getattr(analysis, name))


def test_no_name_is_that_of_a_module_which_would_hide_it_once_imported() -> None:
    modules = {module.name for module in pkgutil.iter_modules(analysis.__path__)}
    assert not modules & set(analysis.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'capsize_treshold'"):
        _ = analysis.capsize_treshold  # type: ignore[attr-defined]


def test_the_package_and_its_names_bring_no_compiler_and_no_plotting_along() -> None:
    source = (
        "import sys, utank_hil.analysis as a\n"
        "early = [m for m in sys.modules if m.startswith('utank_hil.analysis.')]\n"
        "[getattr(a, name) for name in a.__all__]\n"
        "print(early, {'numba', 'matplotlib', 'control'} & set(sys.modules))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", source], capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout.strip() == "[] set()"
