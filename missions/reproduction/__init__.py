"""The paper's exhibits beside ours: `protocol` makes the data, `exhibits` the numbers, `figures` the pictures."""
