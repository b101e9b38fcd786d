"""What is shipped besides `solve` by NumPy: judged through its public calls, by other means than its own."""
