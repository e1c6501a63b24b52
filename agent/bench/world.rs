//! `acm bench world`: what results in the simulated world rest on.
//!
//! | module | measures |
//! |---|---|
//! | [`primitives`] | the nine primitives alone, with exact geometry, over a published table of cases |
//! | [`articulated`] | doors and drawers opened to three quarters and shut again |
//!
//! A module has one function `measure(args, result)` that adds rows and figures to the [`BenchResult`]; [`measure`]
//! calls one after the other. What this machine cannot do is a row that says why.

pub mod articulated;
pub mod primitives;

use super::BenchResult;
use crate::cli::BenchArgs;

/// Measures everything.
///
/// # Errors
/// A world cannot be built.
pub fn measure(args: &BenchArgs) -> anyhow::Result<BenchResult> {
    let mut result = BenchResult::new("world", "none");
    primitives::measure(args, &mut result)?;
    articulated::measure(args, &mut result)?;
    Ok(result)
}
