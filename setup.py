import sys
from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

# colcon --symlink-install runs this file through a link in the build folder.
HERE = Path(__file__).resolve().parent
NODES = ['planner', 'sim', 'replay', 'demo']

# ROS wants one executable per node in lib/flightdyn, where names as short as `sim` are private.
# pip would put them on PATH, so it gets the command line tool only. colcon (and bloom) call
# `setup.py install` or `setup.py develop`; pip never does.
scripts = ['flightdyn = flightdyn.cli:main']
if {'install', 'develop'} & set(sys.argv):
    scripts += [f'{name} = flightdyn.nodes.{name}:main' for name in NODES]


def share(*patterns):
    """List data files by folder, so that they keep their folders under share/flightdyn."""
    folders = {}
    for pattern in patterns:
        for name in sorted(glob(pattern, recursive=True)):
            path = Path(name)
            if path.is_file():
                folders.setdefault(path.parent.as_posix(), []).append(path.as_posix())
    return folders


files = share('config/**', 'launch/*.launch.py', 'flightdyn_msgs/msg/*.msg')
# The message text travels with the Python package: logs can be read and written without ROS.
files['msg'] = files.pop('flightdyn_msgs/msg')
data_files = [
    ('share/ament_index/resource_index/packages', ['resource/flightdyn']),
    ('share/flightdyn', ['package.xml']),
    *((f'share/flightdyn/{folder}', names) for folder, names in sorted(files.items())),
]

lint = ['ruff>=0.17,<0.18', 'mypy>=2.4,<3', 'types-PyYAML>=6']
test = [
    'pytest>=9,<10',
    'pytest-rerunfailures>=15,<17',
    'pytest-timeout>=2.4,<3',
    'pytest-xdist>=3.6,<4',
    'hypothesis>=6.150,<7',
    'mcap-ros2-support>=0.6,<0.7',
    'scipy>=1.15,<2',
    'pyulog>=1,<2',
    'flatbuffers>=24,<26',
    'setuptools>=70.1,<80',  # below 70.1 it makes no wheels by itself; 80 is too new for colcon
]

setup(
    name='flightdyn',
    version='0.1.0',
    description='Flight dynamics for planning, simulation and replay, with and without ROS 2',
    long_description=(HERE / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    author='flightdyn contributors',
    license='MIT',
    license_files=['LICENSE'],
    python_requires='>=3.11',
    packages=find_packages(include=['flightdyn', 'flightdyn.*']),
    package_data={'flightdyn': ['py.typed']},
    data_files=data_files,
    install_requires=[
        'numpy>=1.26,<3',  # 1.26 is what ROS 2 of Ubuntu 24.04 is built with
        'casadi>=3.8,<4',
        'pymap3d>=3.2,<4',
        'rosbags>=0.11,<0.12',
        'mcap>=1.4,<2',
        'zstandard>=0.23,<1',
        'lz4>=4.3,<5',
        'isal>=1.6,<2; platform_machine in "x86_64 AMD64 aarch64 arm64"',
        'PyYAML>=6,<7',
        'rich>=13,<16',
    ],
    extras_require={
        'view': [
            'rerun-sdk>=0.41,<0.42',
            'matplotlib>=3.9,<4',
            'pillow>=10,<14',
            'pyarrow>=18,<27',
        ],
        'ulog': ['pyulog>=1,<2'],
        'aero': ['aerosandbox>=4.2.10,<5', 'neuralfoil>=0.3.3,<0.4'],
        'terrain': ['rasterio>=1.4,<2'],  # GeoTIFFs
        'batch': ['dask>=2025.1,<2027', 'distributed>=2025.1,<2027', 'pyarrow>=18,<27'],
        'bench': [
            'aerosandbox>=4.2.10,<5',
            'mcap-ros2-support>=0.6,<0.7',
            'mcap-ros2-support-fast>=0.8,<0.9',
            'pyarrow>=18,<27',
            'scipy>=1.15,<2',
        ],
        # `colcon test` runs pytest only where an extra of this name asks for it.
        'test': test,
        'dev': test + lint,
    },
    entry_points={'console_scripts': scripts},
    zip_safe=False,
)
