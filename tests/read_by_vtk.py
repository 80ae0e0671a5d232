"""Everything that VTK reads of a VTKHDF file, as numpy arrays: ``python read_by_vtk.py FILE OUT.npz``.

A program of its own that needs VTK and numpy only, so that an older VTK in another environment can run it.
"""

import sys

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkVersion
from vtkmodules.vtkIOHDF import vtkHDFReader


def arrays(path):
    """By name: version, times, and of step k k/points, k/cells, k/active, k/point/NAME, k/field/NAME."""
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

    reader = vtkHDFReader()
    reader.SetFileName(path)
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()) or ()
    assert len(times) in (0, reader.GetNumberOfSteps())
    found = {"version": vtkVersion.GetVTKVersion(), "times": np.array(times)}
    for k in range(len(times) or 1):
        if times:
            reader.SetStep(k)
        reader.Update()
        data = reader.GetOutput()
        assert data.GetClassName() == "vtkPolyData"
        cells = range(data.GetNumberOfCells())
        assert data.GetNumberOfVerts() == len(cells) and all(data.GetCell(c).GetNumberOfPoints() == 1 for c in cells)
        found[f"{k}/points"] = vtk_to_numpy(data.GetPoints().GetData())
        found[f"{k}/cells"] = np.array([data.GetCell(c).GetPointId(0) for c in cells])
        for kind, group in (("point", data.GetPointData()), ("field", data.GetFieldData())):
            for i in range(group.GetNumberOfArrays()):
                found[f"{k}/{kind}/{group.GetArrayName(i)}"] = vtk_to_numpy(group.GetArray(i)).copy()
        active = (data.GetPointData().GetVectors(), data.GetPointData().GetTensors())
        if not times:  # a single snapshot, which tells its own
            found["times"] = found[f"{k}/field/TimeValue"]
        found[f"{k}/active"] = np.array(["" if array is None else array.GetName() for array in active])
    return found


if __name__ == "__main__":
    np.savez(sys.argv[2], **arrays(sys.argv[1]))
