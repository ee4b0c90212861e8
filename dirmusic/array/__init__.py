"""The array: gain patterns, the manifold, errors of the elements and how to learn them, and the bounds."""
