"""Packages that are looked for when something needs them."""


def absent(package: str, purpose: str) -> ImportError:
    """An error with the command that installs what is not there."""
    return ImportError(f"{purpose} needs the package '{package}': pip install {package}")
