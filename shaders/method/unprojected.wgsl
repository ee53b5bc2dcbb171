// For kernels that leave a step's result as it is. Replaced by method/projection.wgsl.

fn load_combinations(i: u32) {
}

fn projected(body: Body, state: State) -> State {
    return state;
}
