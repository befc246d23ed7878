"""Builds the package by scikit-build-core, where the tree that its library is compiled from is whole."""
import pathlib

from scikit_build_core import build
from scikit_build_core.build import *  # noqa: F403: the other hooks

ROOT = pathlib.Path(__file__).resolve().parents[1]
NEEDED = ("CMakeLists.txt", "LICENSE", "cmake", "io", "autograd", "layers", "data", "models", "hardware", "library")


def _check(settings):
    missing = [name for name in NEEDED if not (ROOT / name).exists()]
    if missing and str((settings or {}).get("wheel.cmake", "true")).lower() not in ("false", "off", "0"):
        raise SystemExit(f"supertac: {ROOT} lacks {', '.join(missing)}: the library is compiled from the whole tree; install "
                         "from there (pip install ./python), take a wheel, or leave the library out (-C wheel.cmake=false)")


def get_requires_for_build_wheel(config_settings=None):
    _check(config_settings)
    return build.get_requires_for_build_wheel(config_settings)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    _check(config_settings)
    return build.build_wheel(wheel_directory, config_settings, metadata_directory)
