"""Editor of scenario files: a page on this machine on which a yard is drawn."""
