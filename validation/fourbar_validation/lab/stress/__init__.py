"""What is stressed: forward error, fuzzing, mutation, speed."""
