"""What is read: EndoNeRF folders, splits, validation, depth priors. Every refusal names file, frame and reason."""
