"""Body and yard: what exists physically. Imports none of the other packages."""

__all__ = ["inspector", "world", "yard"]
