"""Random and adversarial scenes through the whole path, by the hundred thousand; what fails is shrunk and kept."""
