"""The version of armload and of installed packages, for files and messages that name them."""

__version__ = "0.1.0"  # of the package


def package_versions(*packages: str) -> dict[str, str]:
    """Versions by name of those of these packages that are installed."""
    from importlib.metadata import PackageNotFoundError, version  # two thirds of `import armload` else

    found = {}
    for name in packages:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
