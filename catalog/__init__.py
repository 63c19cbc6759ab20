"""What exists: cameras, targets, poses, products, kernels and maps. Imports neither Prefect nor `tasks`."""
