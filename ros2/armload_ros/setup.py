"""Builds the package for colcon; armload itself comes from pip."""

from setuptools import setup

NAME = "armload_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/payload.launch.py"]),
        (f"share/{NAME}/config", ["config/payload.yaml"]),
    ],
    install_requires=["setuptools", "armload"],
    zip_safe=True,
    maintainer="armload developers",
    maintainer_email="maintainers@armload.invalid",
    description="What a robot arm holds, from its joint states.",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"payload_identifier = {NAME}.payload_identifier:main"]},
)
