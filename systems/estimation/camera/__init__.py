"""What is to be told of the camera: its noise, and whether it was it or the tool that was displaced."""
