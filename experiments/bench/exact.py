"""How a scenario is integrated as exactly as anyone would want to wait for, by integration scheme."""

# Under radau3 an accuracy of 1e-8 takes minutes where a noisy camera shakes stiff drives at every tick; its
# third order makes these steps as good.
EXACT = {
    "runge_kutta3": ["integrator.accuracy=1.0e-8"],
    "radau3": ["integrator.accuracy=1.0e-6", "integrator.max_step=0.0005"],
}
