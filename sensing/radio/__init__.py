"""From source to element: what stands about, ray paths, what arrives."""
