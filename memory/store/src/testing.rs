//! For tests and benches: numbers from seeds, worlds drawn from them, a disk that fails, and a naive reference.

pub mod crash;
pub mod faults;
pub mod naive;
pub mod worlds;

/// Numbers from a seed: SplitMix64 (Steele, Lea, Flood 2014). The same on every machine.
#[derive(Debug, Clone)]
pub struct Draw(u64);

impl Draw {
    /// From a seed.
    pub fn new(seed: u64) -> Draw {
        Draw(seed)
    }
    /// 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }
    /// From 0 up to but not with `end`.
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end.max(1) as u64) as usize
    }
    /// From 0 up to but not with 1.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }
    /// Whether something of a probability comes about.
    pub fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }
}
