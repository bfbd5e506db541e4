"""What is fitted: the Gaussians as a structure of arrays, their initialisation and density control."""
