//! Fits against evidence made by hand.
