//! What tables and pages call things alike.

use crate::figures::number;
use crate::model::Root;
use crate::optimize::Stopped;
use crate::validate::Part;

/// Why a search ended.
pub(super) fn stopped(stopped: Stopped) -> &'static str {
    match stopped {
        Stopped::Converged => "converged",
        Stopped::NoDescent => "stopped where no step lowers the cost",
        Stopped::MaxIterations => "stopped at the most iterations",
        Stopped::TimeLimit => "stopped by the time limit",
    }
}

/// What rows served for.
pub(super) fn part(part: Part) -> &'static str {
    match part {
        Part::Estimation => "estimation",
        Part::Validation => "validation",
        Part::Test => "test",
    }
}

/// A complex number.
pub(super) fn complex(root: &Root) -> String {
    if root.im == 0.0 {
        return number(root.re);
    }
    let sign = if root.im < 0.0 { '-' } else { '+' };
    format!("{} {sign} {}i", number(root.re), number(root.im.abs()))
}
