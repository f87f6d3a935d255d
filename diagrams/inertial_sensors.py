"""Puts loggers with gyros and accelerometers beside a plant in a diagram."""

from pydrake.common import RandomDistribution, RandomGenerator
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import RandomSource

from systems.cell.inertial_sensors import BLOCK, InertialLoggerConfig, InertialSensors


def add_inertial_sensors(
    builder: DiagramBuilder, plant: MultibodyPlant, loggers: list[InertialLoggerConfig]
) -> tuple[list[RandomSource], dict[str, OutputPort]]:
    """Adds the loggers.

    Args:
        builder: of the diagram that holds the plant.
        plant: finalized.
        loggers: in the order of the ports.

    Returns:
        The sources of their noise, to be seeded by `seed_noise`, and the ports of their samples:
        ``inertial_sample_1``, ``inertial_sample_2``, ...

    Raises:
        ValueError: if a logger refuses its configuration.
    """
    sources, samples = [], {}
    for number, config in enumerate(loggers, 1):
        logger = builder.AddNamedSystem(f"inertial_sensors_{number}", InertialSensors(plant, config))
        for name, port in (
            ("body_poses", plant.get_body_poses_output_port()),
            ("body_velocities", plant.get_body_spatial_velocities_output_port()),
            ("body_accelerations", plant.get_body_spatial_accelerations_output_port()),
        ):
            builder.Connect(port, logger.GetInputPort(name))
        noise = logger.GetInputPort("noise")
        source = RandomSource(RandomDistribution.kGaussian, noise.size(), BLOCK * config.true_period)
        builder.AddNamedSystem(f"inertial_noise_{number}", source)
        builder.Connect(source.get_output_port(), noise)
        samples[f"inertial_sample_{number}"] = logger.GetOutputPort("sample")
        sources.append(source)
    return sources, samples


def seed_noise(sources: list[RandomSource], root_context: Context, seed: int) -> None:
    """Seeds the noise of the loggers; that of each is independent of how many there are."""
    for number, source in enumerate(sources):
        generator = RandomGenerator(seed + 7919 * (number + 1))
        source.SetRandomContext(source.GetMyMutableContextFromRoot(root_context), generator)
