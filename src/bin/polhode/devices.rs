use crate::arguments::DevicesArguments;
use crate::output::Failure;
pub fn devices(_: &DevicesArguments) -> Result<(), Failure> {
    Ok(())
}
