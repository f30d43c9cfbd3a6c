"""What people open and load: reports, model files, the 3D viewer."""
