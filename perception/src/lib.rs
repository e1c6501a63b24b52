//! RGB-D frames, nominal calibration and the memory's expectation in; grounded analytic concepts with uncertainty out.
