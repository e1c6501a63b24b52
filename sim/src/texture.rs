//! Patterns on surfaces and objects, drawn anew each episode where the scenario asks for it.

use crate::{
    layout::{LayoutError, number},
    random::Scope,
    scenario::{TextureKind, TextureSpec},
};
use acm_render::{Pattern, PatternKind};

/// Edge of a cell, metres, where a scenario gives none; and its limits.
const CELL_M: f64 = 0.03;
const CELLS_M: std::ops::RangeInclusive<f64> = 0.001..=1.0;

/// The first pattern whose condition holds. `name` is whose patterns these are, for messages.
pub(crate) fn chosen(name: &str, textures: &[TextureSpec], scope: &Scope) -> Result<Option<Pattern>, LayoutError> {
    for texture in textures {
        let holds = texture.when.as_ref().map_or(Ok(1.0), |when| number(name, when, scope))?;
        if holds <= 0.0 {
            continue;
        }
        let cell_m = texture.cell_m.as_ref().map_or(Ok(CELL_M), |cell| number(name, cell, scope))?;
        if !CELLS_M.contains(&cell_m) {
            let reason = format!("texture.cell_m {cell_m} must lie in {} to {}", CELLS_M.start(), CELLS_M.end());
            return Err(LayoutError::Value { name: name.into(), reason });
        }
        let hue_deg = texture.hue_deg.as_ref().map(|hue| number(name, hue, scope)).transpose()?;
        let color = hue_deg.map_or(texture.color.0, |hue_deg| with_hue(texture.color.0, hue_deg));
        let kind = match texture.kind {
            TextureKind::Checker => PatternKind::Checker,
            TextureKind::Stripes => PatternKind::Stripes,
            TextureKind::Speckle => PatternKind::Speckle,
        };
        return Ok(Some(Pattern { kind, color, cell_m }));
    }
    Ok(None)
}

/// The colour with another hue, its saturation and brightness (HSV) kept: greys stay grey.
pub(crate) fn with_hue(color: [u8; 3], hue_deg: f64) -> [u8; 3] {
    let [high, low] = [f64::from(color.into_iter().fold(0, u8::max)), f64::from(color.into_iter().fold(255, u8::min))];
    let channel = |offset: f64| {
        let sector = (offset + hue_deg.rem_euclid(360.0) / 60.0) % 6.0;
        let share = sector.min(4.0 - sector).clamp(0.0, 1.0);
        (high - (high - low) * share).round() as u8
    };
    [channel(5.0), channel(3.0), channel(1.0)]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use crate::{Scenario, SimOptions, layout::Layout, scene::Stage, testbed, world::World};

    const DRAWN: &str = "[random]\nstream = 'chacha8'\n[[random.draw]]\nname = 'cell'\nkind = 'uniform'\nlow = 0.01\nhigh = 0.05\n\
                         [[object]]\nname = 'thing'\nmodel = 'red-cube'\nposition = [0, 0, 0.74]\n\
                         [[object.texture]]\nkind = 'checker'\ncolor = '#ffffff'\nwhen = 'cell > 1'\n\
                         [[object.texture]]\nkind = 'stripes'\ncolor = '#c02020'\nhue_deg = 240\ncell_m = 'cell'\n";

    #[test]
    fn the_first_pattern_that_holds_is_painted_anew_each_episode() {
        let scenario = Scenario::parse("t.toml", &testbed::object_text(DRAWN)).unwrap();
        let patterns = [1, 2].map(|seed| {
            let world = World::new(&scenario, &SimOptions { seed, ..SimOptions::default() }).unwrap();
            let scene = Stage::new(&world).unwrap().scene(&world);
            let patterns: Vec<_> = scene.instances.iter().filter_map(|instance| instance.material.pattern).collect();
            assert_eq!(patterns.len(), 1, "the cube alone is painted");
            patterns[0]
        });
        assert_eq!(patterns[0].kind, acm_render::PatternKind::Stripes);
        assert!(patterns[0].color[2] > patterns[0].color[0], "red became blue");
        assert!(patterns.iter().all(|pattern| (0.01..0.05).contains(&pattern.cell_m)));
        assert_ne!(patterns[0].cell_m, patterns[1].cell_m);
    }

    #[test]
    fn cells_of_no_sensible_size_are_refused() {
        let text = testbed::object_text(&DRAWN.replace("cell_m = 'cell'", "cell_m = 3"));
        let scenario = Scenario::parse("t.toml", &text).unwrap();
        let told = Layout::draw(&scenario.world, 0).unwrap_err().to_string();
        assert!(told.contains("thing") && told.contains("texture.cell_m 3"), "{told}");
    }
}
