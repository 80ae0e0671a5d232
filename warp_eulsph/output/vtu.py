"""Snapshots as VTK's XML files: ``.vtu`` one time, ``.pvd`` all of them, for programs that read no HDF5."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from .snapshot import read_snapshot
from .tensors import padded


def write_pvd(temporary: Path, target: Path, files: list[Path], names: list[str]) -> None:
    """The collection, and a ``.vtu`` per time in a folder of the target's name beside it."""
    folder = target.with_suffix("")
    folder.mkdir(exist_ok=True)
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(root, "Collection")
    for k, path in enumerate(files):
        piece = folder / f"{k:06d}.vtu"
        time = _write(piece, path, names)
        ElementTree.SubElement(collection, "DataSet", timestep=repr(time), file=f"{folder.name}/{piece.name}")
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(temporary, encoding="utf-8", xml_declaration=True)


def write_vtu(temporary: Path, target: Path, files: list[Path], names: list[str]) -> None:
    """One time."""
    if len(files) != 1:
        raise ValueError(f"{target}: a .vtu holds one frame, got {len(files)}; choose one (--frames -1), or a .pvd")
    _write(temporary, files[0], names)


def _write(target: Path, file: Path, names: list[str]) -> float:
    """One snapshot; its time [s]. Vectors have three components and tensors nine, as VTK knows them."""
    pyvista = _pyvista()
    snapshot = read_snapshot(file)
    grid = pyvista.PolyData(_three(snapshot.x)).cast_to_unstructured_grid()
    for name in names:
        grid.point_data[name] = _three(snapshot.fields[name])
    grid.field_data["TimeValue"] = np.array([snapshot.time])
    whole = target.with_name(target.name + ".part.vtu")  # the ending decides what is written
    grid.save(whole)
    whole.replace(target)
    return float(snapshot.time)


def _three(values: np.ndarray) -> np.ndarray:
    """Scalars as they are, vectors (n, 3), tensors (n, 9)."""
    if values.ndim == 1:
        return values
    if values.ndim == 2:
        return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))
    return (values if values.shape[1] == 3 else padded(values, 1.0)).reshape(len(values), 9)


def _pyvista() -> Any:
    try:
        import pyvista
    except ModuleNotFoundError:
        raise ModuleNotFoundError("files .vtu and .pvd need PyVista: pip install 'warp_eulsph[viz]'") from None
    return pyvista
