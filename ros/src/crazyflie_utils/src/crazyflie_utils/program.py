"""Starts programs by name, and names the package of a Python module that is missing."""

import importlib
import os
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NoReturn

#: Modules that may be missing -> section of ros/debian.txt and ros/requirements.txt that installs
#: them, and package. Those of PyPI are named as there, those of Debian begin with python3-.
PACKAGES = {
    "cflib": ("demo", "cflib"),
    "control": ("demo", "control"),
    "cv2": ("vision", "python3-opencv"),
    "cv_bridge": ("vision", "python3-cv-bridge"),
    "distributed": ("batch", "python3-distributed"),
    "libusb_package": ("demo", "libusb-package"),
    "lz4": ("demo", "lz4"),
    "llvmlite": ("batch", "python3-llvmlite"),
    "matplotlib": ("vehicles", "python3-matplotlib"),
    "motioncapture": ("demo", "motioncapture"),
    "natnet": ("demo", "natnet"),
    "nicegui": ("dashboard", "nicegui"),
    "numpy": ("demo", "python3-numpy"),
    "PIL": ("dashboard", "python3-pil"),
    "pytest": ("tests", "python3-pytest"),
    "rosbags": ("demo", "rosbags"),
    "scipy": ("vehicles", "python3-scipy"),
    "tqdm": ("demo", "python3-tqdm"),
    "usb": ("vehicles", "python3-usb"),
    "xacro": ("demo", "xacro"),
}


def missing_module(error: BaseException | None) -> str:
    """Return a sentence with the module of `PACKAGES` that is missing, and how to install it.

    The missing module is the cause of an error, or the cause of its cause; the text is empty if no
    module is missing.
    """
    while error is not None:
        name = ((isinstance(error, ModuleNotFoundError) and error.name) or "").partition(".")[0]
        if name in PACKAGES:
            section, package = PACKAGES[name]
            manager = "apt install" if package.startswith("python3-") else "pip install"
            return (
                f"the Python module {name} is missing; ./run install {section} installs it, "
                f"or {manager} {package}"
            )
        error = error.__cause__
    return ""


def load(path: str) -> Any:
    """Import and return the object named as "package.module:name"."""
    module, _, name = path.partition(":")
    return getattr(importlib.import_module(module), name)


def load_recorded(path: str) -> Any:
    """Do the same for a name in a file, which anybody may have written.

    Importing a module may do anything: `ImportError` for one that is neither loaded nor in a
    folder of PYTHONPATH, as all packages of workspaces are.
    """
    module = path.partition(":")[0]
    spec = None if module in sys.modules else find_spec(module.partition(".")[0])
    if spec is not None:
        folders = [Path(each) for each in os.environ.get("PYTHONPATH", "").split(":") if each]
        if not any(folder in Path(spec.origin or "").parents for folder in folders):
            raise ImportError(f"{module:.80} is in no folder of PYTHONPATH; it is not imported")
    return load(path)


def run_program(path: str) -> NoReturn:
    """Exit with the status that the function "package.module:function" returns.

    The exit status is 1, with a sentence, if a module of `PACKAGES` is missing.
    """
    try:
        sys.exit(load(path)())
    except ImportError as error:
        if text := missing_module(error):
            sys.exit(f"{Path(sys.argv[0]).name}: {text}")
        raise
