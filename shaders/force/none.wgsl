// No centre of mass to advance: positions are constant, in closed form, or on the host. Twin: none, as nothing is done.

struct SteppedTranslation {
    unused: u32,
}

fn load_translation(i: u32, body: Body, step_index: u32, dt: TwoWordsReal, state: State) -> SteppedTranslation {
    return SteppedTranslation(0u);
}

fn advance_translation(translation: SteppedTranslation, body: Body, step_index: u32, dt: TwoWordsReal, state: State) -> SteppedTranslation {
    return translation;
}

fn store_translation(translation: SteppedTranslation, i: u32) {
}
