// No centre of mass to advance: positions are constant, in closed form, or on the host. Twin: none, as nothing is done.

struct SteppedTranslation {
    unused: u32,
}

fn take_off(i: u32, body: Body, step_index: u32, dt: TwoWordsReal, state: State) -> SteppedTranslation {
    return SteppedTranslation(0u);
}

fn follow(translation: SteppedTranslation, body: Body, step_index: u32, dt: TwoWordsReal, state: State) -> SteppedTranslation {
    return translation;
}

fn land(translation: SteppedTranslation, i: u32) {
}
