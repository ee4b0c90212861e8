"""Body and yard: what exists physically. Imports none of the other packages; import its modules by name."""

__all__: list[str] = []
