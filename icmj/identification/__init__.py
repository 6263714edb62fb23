"""The inverse problem: the model error that explains a measured motion."""
