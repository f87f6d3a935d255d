"""What further motions and sensors would tell of an arm: information before anything is recorded."""
