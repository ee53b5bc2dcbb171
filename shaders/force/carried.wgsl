// Centres of mass that are advanced with the steps of the rotation. Twin: SteppedTranslation in src/run/stepped_translation.rs, on the
// host; the columns are those of src/torque/force/carried.rs.

// The first parameter column of the forces.
override forces_first: u32 = 0u;

// The first state column of position and velocity.
const CENTRE_FIRST: u32 = 7u * WORDS + 1u;

// A body's centre of mass with the forces on it, and the rotation at its time.
struct SteppedTranslation {
    centre: Centre,
    forces: Accelerations,
    orientation: quaternion,
    // Change of the orientation in a step at the present rate.
    rate: quaternion,
}

// The attitude in a state, normalised. Its quaternion is off the unit sphere by the method's truncation, and the cubic between two
// quaternions of other norms is not a rotation.
fn attitude_of(state: State) -> quaternion {
    return plainly_normalised(state.orientation.value).value;
}

// The change of the orientation in a step at the present rate at which the axes turn.
fn turning_in_step(body: Body, step_index: u32, dt: TwoWordsReal, state: State) -> quaternion {
    let m = state.angular_momentum_principal.value;
    let motion = motion(epoch(step_index, 0.0), body, correction(body, state), m);
    return orientation_rate(attitude_of(state), motion.axes_rate * dt.value);
}

fn load_translation(i: u32, body: Body, step_index: u32, dt: TwoWordsReal, state: State) -> SteppedTranslation {
    return SteppedTranslation(load_centre(i), load_forces(i), attitude_of(state), turning_in_step(body, step_index, dt, state));
}

// Advances the centre of mass over a step of the rotation, which is `state` after it.
fn advance_translation(translation: SteppedTranslation, body: Body, step_index: u32, dt: TwoWordsReal, state: State) -> SteppedTranslation {
    // The state is that at the start of the next step.
    let rate = turning_in_step(body, step_index + 1u, dt, state);
    let orientation = attitude_of(state);
    let attitude = between_new(translation.orientation, translation.rate, orientation, rate);
    let span = TwoWordsReal(settings.dt_value, settings.dt_residue);
    let centre = centre_advance(translation.centre, translation.forces, attitude, span);
    return SteppedTranslation(centre, translation.forces, orientation, rate);
}

fn force_vector(column: u32, i: u32) -> vector {
    let first = forces_first + column;
    return vector(parameter_at(first, i), parameter_at(first + 1u, i), parameter_at(first + 2u, i));
}

fn load_forces(i: u32) -> Accelerations {
    return Accelerations(
        force_vector(0u, i),
        parameter_at(forces_first + 3u, i),
        parameter_at(forces_first + 4u, i),
        force_vector(5u, i),
    );
}

fn centre_vector(column: u32, i: u32) -> vector {
    let first = CENTRE_FIRST + column;
    return vector(state_at(first, i), state_at(first + 1u, i), state_at(first + 2u, i));
}

fn load_centre(i: u32) -> Centre {
    var position_residue = vector(0.0, 0.0, 0.0);
    var velocity_residue = vector(0.0, 0.0, 0.0);
    if (WORDS == 2u) {
        position_residue = centre_vector(6u, i);
        velocity_residue = centre_vector(9u, i);
    }
    return Centre(
        TwoWordsVector(centre_vector(0u, i), position_residue),
        TwoWordsVector(centre_vector(3u, i), velocity_residue),
    );
}

fn store_centre_vector(column: u32, i: u32, v: vector) {
    let stride = settings.stride;
    let first = CENTRE_FIRST + column;
    state_columns[first * stride + i] = v.x;
    state_columns[(first + 1u) * stride + i] = v.y;
    state_columns[(first + 2u) * stride + i] = v.z;
}

fn store_translation(translation: SteppedTranslation, i: u32) {
    store_centre_vector(0u, i, translation.centre.position.value);
    store_centre_vector(3u, i, translation.centre.velocity.value);
    if (WORDS == 2u) {
        store_centre_vector(6u, i, translation.centre.position.residue);
        store_centre_vector(9u, i, translation.centre.velocity.residue);
    }
}
