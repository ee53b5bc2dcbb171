// Translation along the rotation, in steps of the classical Runge-Kutta method. Twin: src/torque/force/stepped.rs, which describes the
// method and its errors; `Accelerations` is from src/torque/force/mod.rs.

const DRAG_ANGLE: real = 0.015625;

// All forces on a body, per unit mass.
struct Accelerations {
    constant_world: vector,
    linear_drag: real,
    quadratic_drag: real,
    // In principal axes.
    thrust: vector,
}

// A centre of mass that is being stepped: m and m/s, world axes.
struct Centre {
    position: TwoWordsVector,
    velocity: TwoWordsVector,
}

// The cubic between the orientations before and after one step of a rotation.
struct Between {
    start: quaternion,
    start_rate: quaternion,
    end: quaternion,
    end_rate: quaternion,
}

// dv/dt in world axes, m/s^2.
fn acceleration_at(forces: Accelerations, orientation: quaternion, velocity: vector) -> vector {
    return forces.constant_world - velocity * forces.linear_drag
        + quadratic_drag_acceleration(forces.quadratic_drag, velocity)
        + thrust_acceleration(forces.thrust, orientation);
}

// Rates are those over the whole step.
fn between_new(start: quaternion, start_rate: quaternion, end: quaternion, end_rate: quaternion) -> Between {
    // Both signs are the same orientation; take the nearer one.
    let opposite = dot_quaternion(start, end) < 0.0;
    return Between(start, start_rate, select(end, -end, opposite), select(end_rate, -end_rate, opposite));
}

fn dot_quaternion(a: quaternion, b: quaternion) -> real {
    return mul_add(a.w, b.w, mul_add(a.z, b.z, mul_add(a.y, b.y, a.x * b.x)));
}

// The orientation at a fraction s of the step.
fn between_at(between: Between, s: real) -> quaternion {
    let r = 1.0 - s;
    let start = r * r * (1.0 + 2.0 * s);
    let end = s * s * (1.0 + 2.0 * r);
    let values = between.start * start + between.end * end;
    let sum = values + between.start_rate * (s * r * r) + between.end_rate * (-s * s * r);
    return sum * (1.0 / sqrt(norm_squared(sum)));
}

// Advances by `span` seconds while the body turns as `attitude` says.
fn centre_advance(centre: Centre, forces: Accelerations, attitude: Between, span: TwoWordsReal) -> Centre {
    let driving = length_of(forces.constant_world) + length_of(forces.thrust);
    var moved = centre;
    var fraction: real = 0.0;
    // A velocity that is NaN ends the loop after its step, as every comparison with it is false.
    while (fraction < 1.0) {
        let rate = forces.linear_drag + quadratic_drag_rate(forces.quadratic_drag, moved.velocity.value, driving);
        let longest = DRAG_ANGLE / max(rate * span.value, DRAG_ANGLE);
        // As many equal steps as would reach the end, so that no sliver is left.
        let left = 1.0 - fraction;
        let steps = ceil(left / longest);
        let next = fraction + left / steps;
        // If the rate is too great, a fraction cannot express the step.
        let end = select(real(1.0), next, steps > 1.0 && next > fraction);
        let part = end - fraction;
        moved = centre_step(
            moved,
            forces,
            between_at(attitude, fraction),
            between_at(attitude, 0.5 * (fraction + end)),
            between_at(attitude, end),
            TwoWordsReal(part * span.value, part * span.residue),
        );
        fraction = end;
    }
    return moved;
}

fn length_of(v: vector) -> real {
    return sqrt(dot_vector(v, v));
}

// One step of h seconds; the attitudes are those at its start, middle and end.
fn centre_step(
    centre: Centre,
    forces: Accelerations,
    start: quaternion,
    middle: quaternion,
    end: quaternion,
    h: TwoWordsReal,
) -> Centre {
    let v = centre.velocity.value;
    let k1 = acceleration_at(forces, start, v);
    let k2 = acceleration_at(forces, middle, axpy_vector(k1, 0.5 * h.value, v));
    let k3 = acceleration_at(forces, middle, axpy_vector(k2, 0.5 * h.value, v));
    let k4 = acceleration_at(forces, end, axpy_vector(k3, h.value, v));
    // The terms that are small compared with v h, whose product is then rounded once with their sum.
    let small = axpy_vector(k1 + k2 + k3, h.value * h.value * (1.0 / 6.0), rounded_vector(v * h.residue));
    let path = axpy_vector(v, h.value, axpy_vector(centre.velocity.residue, h.value, small));
    let change = (k1 + (k2 + k3) * 2.0 + k4) * (h.value * (1.0 / 6.0));
    return Centre(accumulate_vector(centre.position, path), accumulate_vector(centre.velocity, change));
}
