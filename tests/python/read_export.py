"""Reads an exported state with VTK: cells, names, reference positions, a contour and a clip."""

import sys

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import VTK_HEXAHEDRON, vtkPlane
from vtkmodules.vtkFiltersCore import vtkContourFilter
from vtkmodules.vtkFiltersGeneral import vtkClipDataSet
from vtkmodules.vtkFiltersVerdict import vtkCellSizeFilter
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

reader = vtkXMLUnstructuredGridReader()
reader.SetFileName(sys.argv[1])
reader.Update()
assert reader.GetErrorCode() == 0
grid = reader.GetOutput()
data = grid.GetPointData()

types = {grid.GetCellType(cell) for cell in range(grid.GetNumberOfCells())}
assert types == {VTK_HEXAHEDRON}, types
print(f"{grid.GetNumberOfPoints()} points, {grid.GetNumberOfCells()} hexahedra")

for number in range(data.GetNumberOfArrays()):
    array = data.GetArray(number)
    components = range(array.GetNumberOfComponents())
    names = [array.GetComponentName(component) or "-" for component in components]
    print(f"{array.GetName()}:", *names)

positions = vtk_to_numpy(grid.GetPoints().GetData())
reference = vtk_to_numpy(data.GetArray("reference_position"))
displacement = vtk_to_numpy(data.GetArray("displacement"))
assert np.abs(displacement).max() > 1e-6, "the block expands"
assert np.abs(reference + displacement - positions).max() < 1e-8

# volumes are positive where the corners are in VTK's order, and fill the block between the outermost points
sizes = vtkCellSizeFilter()
sizes.SetInputData(grid)
sizes.Update()
volumes = vtk_to_numpy(sizes.GetOutput().GetCellData().GetArray("Volume"))
assert volumes.min() > 0
assert abs(volumes.sum() / (19 * 9 * 4 * 1e-9) - 1) < 0.05, volumes.sum()

along = numpy_to_vtk(np.ascontiguousarray(reference[:, 0]), deep=True)
along.SetName("along")
data.AddArray(along)
data.SetActiveScalars("along")
contour = vtkContourFilter()
contour.SetInputData(grid)
contour.SetValue(0, 0.00905)
contour.Update()
surface = contour.GetOutput()
assert surface.GetNumberOfCells() > 0
# a plane across the undeformed block
at = vtk_to_numpy(surface.GetPoints().GetData())[:, 0]
assert np.ptp(at) < 1e-4, at
print(surface.GetNumberOfCells(), "cells of the contour")

plane = vtkPlane()
plane.SetOrigin(0.01, 0, 0)
plane.SetNormal(1, 0, 0)
clip = vtkClipDataSet()
clip.SetInputData(grid)
clip.SetClipFunction(plane)
clip.Update()
kept = clip.GetOutput().GetNumberOfCells()
assert 0 < kept < grid.GetNumberOfCells() + 100, kept
print(kept, "cells beyond the plane")
