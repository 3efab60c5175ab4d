"""Writes the files of this folder with VTK (pip install vtk numpy): one grid of two hexahedra in every encoding.

The array `T` at points is 300 + 10 x + 20 y + 40 z, `Tc` in cells the same at their centres, `v` a vector.
"""

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk

corners = [(x, y, z) for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0, 3.0)]
grid = vtk.vtkUnstructuredGrid()
points = vtk.vtkPoints()
points.SetDataTypeToDouble()
for corner in corners:
    points.InsertNextPoint(corner)
grid.SetPoints(points)
for first in (0, 1):
    cell = vtk.vtkHexahedron()
    for local, step in enumerate((0, 1, 4, 3, 6, 7, 10, 9)):
        cell.GetPointIds().SetId(local, first + step)
    grid.InsertNextCell(cell.GetCellType(), cell.GetPointIds())


def temperature(x):
    return 300 + x @ np.array([10.0, 20.0, 40.0])


def add(data, name, values):
    array = numpy_to_vtk(values, deep=True)
    array.SetName(name)
    data.AddArray(array)


positions = np.array(corners)
add(grid.GetPointData(), "T", temperature(positions))
add(grid.GetPointData(), "v", positions.astype(np.float32))
add(grid.GetCellData(), "Tc", temperature(np.array([[0.5, 0.5, 0.5], [2.0, 0.5, 0.5]])).astype(np.float32))

for name, mode, encode, compressor, long_headers in [
    ("ascii", "Ascii", False, None, True),
    ("binary", "Binary", False, None, False),
    ("binary_zlib", "Binary", False, "ZLib", True),
    ("appended_raw", "Appended", False, None, True),
    ("appended_raw_zlib", "Appended", False, "ZLib", False),
    ("appended_base64", "Appended", True, None, False),
    ("appended_base64_zlib", "Appended", True, "ZLib", True),
    ("appended_raw_lz4", "Appended", False, "LZ4", True),
    ("big_endian", "Appended", False, None, True),
]:
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(f"{name}.vtu")
    writer.SetInputData(grid)
    getattr(writer, f"SetDataModeTo{mode}")()
    writer.SetEncodeAppendedData(encode)
    if name == "big_endian":
        writer.SetByteOrderToBigEndian()
    if compressor is None:
        writer.SetCompressorTypeToNone()
    else:
        getattr(writer, f"SetCompressorTypeTo{compressor}")()
        # several blocks
        writer.SetBlockSize(64)
    if long_headers:
        writer.SetHeaderTypeToUInt64()
    else:
        writer.SetHeaderTypeToUInt32()
    writer.Write()
