"""The fitted scene: the Gaussians as a structure of arrays, their initialisation and density control."""
