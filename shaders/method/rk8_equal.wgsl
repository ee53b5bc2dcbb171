// Equal steps of rk8. Twin: Rk8 and EqualStep in src/kernel/method/rk8.rs.

// One of the interval's equal steps.
struct StepPlace {
    step_index: u32,
}

fn epoch_at(place: StepPlace, fraction: real) -> Epoch {
    return epoch(place.step_index, fraction);
}

fn step(body: Body, prepared: Prepared, step_index: u32, dt: TwoWordsReal, state: State) -> State {
    let tried = slopes(body, StepPlace(step_index), dt.value, state);
    return advanced(tried, dt, state);
}
