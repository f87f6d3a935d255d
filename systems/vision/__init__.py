"""From markers in camera images to the pose of the tool."""
