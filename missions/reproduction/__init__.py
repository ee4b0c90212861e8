"""The paper's exhibits beside ours: `reproduce` runs them all, `tables` and `figures` show them."""
