// constant-body: a torque that is constant in body axes. Twin: src/torque/constant_body.rs, where it is described.

fn constant_body(torque_principal: vector) -> vector {
    return torque_principal;
}
