"""``truetip accept``: acceptance tests of robot and cameras."""

from experiments.accept.cameras_command import accept_cameras_command
from experiments.accept.robot_command import accept_robot_command
from experiments.accept.tracker_command import accept_tracker_command
from experiments.cli.command_app import command_app

accept_app = command_app("Acceptance tests: the robot after ISO 9283, the cameras after VDI/VDE 2634.")
accept_app.command("robot")(accept_robot_command)
accept_app.command("cameras")(accept_cameras_command)
accept_app.command("tracker")(accept_tracker_command)
