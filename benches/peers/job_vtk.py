#!/usr/bin/env python3
"""A folder of OBJ frames to PNG by VTK: rasterised off screen, flat, one light, no shadows. Less work than tracing rays; it
stands here because many would take it.

  pip install vtk
  apt-get install libegl1 libosmesa6 libgl1
  python job_vtk.py FOLDER OUT --eye 0.05,0.16,0.35 --look-at=-0.017,0.11,0 --light 0.3,0.6,0.5"""
import job

a = job.options(__doc__).parse_args()

import vtk
vtk.vtkObject.GlobalWarningDisplayOff()

window = vtk.vtkRenderWindow()
window.SetOffScreenRendering(1)
window.SetSize(*map(int, a.size.split("x")))
window.SetMultiSamples(0)
window.SetAlphaBitPlanes(a.alpha)
renderer = vtk.vtkRenderer()
renderer.SetAutomaticLightCreation(0)
renderer.SetBackgroundAlpha(0)
window.AddRenderer(renderer)
light = vtk.vtkLight()
light.SetPositional(1)
light.SetPosition(*a.light)
light.SetConeAngle(180)
renderer.AddLight(light)
mapper = vtk.vtkPolyDataMapper()
actor = vtk.vtkActor()
actor.SetMapper(mapper)
actor.GetProperty().SetInterpolationToFlat()
renderer.AddActor(actor)
camera = renderer.GetActiveCamera()
camera.SetPosition(*a.eye)
camera.SetFocalPoint(*a.look_at)
camera.SetViewUp(0, 1, 0)
camera.SetViewAngle(a.fov)


def frame(file, picture):
    with job.stage("read"):
        reader = vtk.vtkOBJReader()
        reader.SetFileName(file)
        reader.Update()
    with job.stage("update and draw"):
        mapper.SetInputData(reader.GetOutput())
        renderer.ResetCameraClippingRange()
        window.Render()
        image = vtk.vtkWindowToImageFilter()
        image.SetInput(window)
        if a.alpha:
            image.SetInputBufferTypeToRGBA()
        image.ReadFrontBufferOff()
        image.Update()
    with job.stage("write"):
        writer = vtk.vtkPNGWriter()
        writer.SetFileName(picture)
        writer.SetInputData(image.GetOutput())
        writer.Write()


job.run(a, "vtk", vtk.vtkVersion.GetVTKVersion(), frame)
