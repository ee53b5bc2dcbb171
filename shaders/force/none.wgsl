// No centre of mass to move along: positions are still, in closed form, or on the host. Twin: none, as nothing is done.

struct Flight {
    unused: u32,
}

fn take_off(i: u32, body: Body, step_index: u32, dt: TwoWordsReal, state: State) -> Flight {
    return Flight(0u);
}

fn follow(flight: Flight, body: Body, step_index: u32, dt: TwoWordsReal, state: State) -> Flight {
    return flight;
}

fn land(flight: Flight, i: u32) {
}
