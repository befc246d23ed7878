#!/usr/bin/env python3
"""Recordings and picture logs as one HDF5 file (needs the packages supertac, from ../python, and h5py):

    examples/to_hdf5.py OUT.h5 FILE.safetensors ...

Each file is a group: time_s [n], volts [n,signals] in the unit of attribute "signals", and what else it has, such as
position_mm [n,2] or pictures [n,height,width]; its metadata are the group's attributes.
"""
import pathlib
import sys

if sys.argv[1:] in ([], ["-h"], ["--help"]):
    print(__doc__)
    sys.exit(0 if sys.argv[1:] else 2)

import h5py  # noqa: E402
import supertac  # noqa: E402


def main(out, *files):
    with h5py.File(out, "x") as file:
        for path in map(pathlib.Path, files):
            tensors, metadata = supertac.read(path)
            group = file.create_group(path.stem)
            for name, values in tensors.items():
                group.create_dataset(name, data=values, compression="gzip", shuffle=True)
            group.attrs.update(metadata)
            print(f"{path.stem}: {len(tensors['time_s'])} frames, {', '.join(tensors)}")


if __name__ == "__main__":
    main(*sys.argv[1:])
