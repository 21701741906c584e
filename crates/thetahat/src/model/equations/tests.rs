mod derivatives;
mod expressions;
mod figures;
mod linear;
mod linearized;
mod models;
mod refusals;
mod tables;

/// A cart that is pushed, with an unknown mass.
pub(crate) const CART: &str = "\
sample_time = 0.1

[states]
position = { start = 0, sd = 1 }
velocity = { start = 0.5, sd = 2 }

[inputs]
force = \"u\"

[parameters]
mass = { start = 2, sd = 1, unknown = true, min = 0.1 }
damping = 0.4

[next]
position = \"position + dt * velocity\"
velocity = \"velocity + dt * (force - damping * velocity) / mass\"

[outputs]
y = \"position\"

[noise]
process = { velocity = 0.01 }
measurement = { y = 0.05 }
";

/// A driven pendulum in continuous time, with all kinds of bounds on unknown parameters.
pub(crate) const PENDULUM: &str = "\
sample_time = 0.2

[states]
angle = { start = 0.4, sd = 0.1 }
rate = { start = -0.2, sd = 0 }

[inputs]
torque = 'u'

[parameters]
stiffness = { start = 9, sd = 1, unknown = true, min = 0 }
friction = { start = 0.3, sd = 0.1, unknown = true, min = 0, max = 1 }
bias = { start = 0.05, sd = 0.1, unknown = true }
length = { start = 0.8, sd = 0.1, unknown = true, max = 2, walk = 0.01 }

[derivative]
angle = 'rate + bias * cos(t)'
rate = 'torque - stiffness * sin(angle) / length - friction * rate * abs(rate)'

[outputs]
end = 'length * sin(angle)'
gyro = 'rate + bias'

[noise]
process = { rate = 0.1 }
measurement = { end = 0.01, gyro = 0.02 }
";
