"""Judge what is shipped besides `solve` by NumPy, through its public calls and by other means than its own."""
