//! Sums that the threads of a sweep write to shared memory.

use std::marker::PhantomData;

/// Sums by point, shared by the threads of a sweep.
pub(super) struct Output<'a, const O: usize> {
    /// Address of each sum of the first point, and the distance to that of the next point.
    sums: [(*mut f64, usize); O],
    pub(super) len: usize,
    borrowed: PhantomData<&'a mut f64>,
}

// SAFETY: `Output` only writes, and by the contract of `Output::set` no two threads write the same element.
unsafe impl<const O: usize> Sync for Output<'_, O> {}

impl<'a, const O: usize> Output<'a, O> {
    pub(super) fn new(sums: &'a mut [[f64; O]]) -> Self {
        let first = sums.as_mut_ptr().cast::<f64>();
        Output {
            sums: std::array::from_fn(|o| (first.wrapping_add(o), O)),
            len: sums.len(),
            borrowed: PhantomData,
        }
    }

    /// Sets the sums of a point.
    ///
    /// # Safety
    /// `point` is below `len`, and no other thread sets the sums of this point at the same time.
    #[inline(always)]
    pub(super) unsafe fn set(&self, point: usize, value: [f64; O]) {
        debug_assert!(point < self.len);
        for ((first, stride), value) in self.sums.into_iter().zip(value) {
            // SAFETY: the element belongs to the borrowed slices, as `point` is below their length; the caller
            // guarantees that no other thread writes it.
            unsafe { *first.add(point * stride) = value }
        }
    }
}

impl<'a> Output<'a, 4> {
    /// Writes three sums to `vectors` and the fourth to `last`.
    pub(super) fn apart(vectors: &'a mut [[f64; 3]], last: &'a mut [f64]) -> Self {
        let Output {
            sums: [x, y, z],
            len,
            borrowed,
        } = Output::new(vectors);
        assert_eq!(last.len(), len, "as many as vectors");
        Output {
            sums: [x, y, z, (last.as_mut_ptr(), 1)],
            len,
            borrowed,
        }
    }
}

/// `O` sums by slot, each in a plane of its own, shared by the threads of a sweep.
pub(super) struct Planes<'a, const O: usize> {
    first: *mut f64,
    slots: usize,
    borrowed: PhantomData<&'a mut f64>,
}

// SAFETY: by the contracts of `get` and `set` no thread accesses an element that another one writes.
unsafe impl<const O: usize> Sync for Planes<'_, O> {}

impl<'a, const O: usize> Planes<'a, O> {
    /// Planes of so many slots in `memory`, which is zero or left from planes whose sums were all taken.
    pub(super) fn new(memory: &'a mut Vec<f64>, slots: usize) -> Self {
        memory.resize(O * slots, 0.0);
        Planes {
            first: memory.as_mut_ptr(),
            slots,
            borrowed: PhantomData,
        }
    }

    #[inline(always)]
    fn at<const N: usize>(&self, plane: usize, slot: usize) -> *mut [f64; N] {
        assert!(plane < O && slot + N <= self.slots, "within the plane");
        // SAFETY: `new` made `O` planes of `slots` elements.
        unsafe { self.first.add(plane * self.slots + slot).cast() }
    }

    /// The sums of `N` slots.
    ///
    /// # Safety
    /// No other thread writes sums of these slots at the same time.
    #[inline(always)]
    pub(super) unsafe fn get<const N: usize>(&self, plane: usize, slot: usize) -> [f64; N] {
        // SAFETY: `at` checks the bounds; the caller guarantees that nobody writes there.
        unsafe { *self.at(plane, slot) }
    }

    /// Sets the sums of `N` slots.
    ///
    /// # Safety
    /// No other thread accesses sums of these slots at the same time.
    #[inline(always)]
    pub(super) unsafe fn set<const N: usize>(&self, plane: usize, slot: usize, sums: [f64; N]) {
        // SAFETY: `at` checks the bounds; the caller guarantees that nobody accesses the slots.
        unsafe { *self.at(plane, slot) = sums }
    }

    /// Adds to the sums of `N` slots.
    ///
    /// # Safety
    /// No other thread accesses sums of these slots at the same time.
    #[inline(always)]
    pub(super) unsafe fn add<const N: usize>(&self, plane: usize, slot: usize, parts: [f64; N]) {
        // SAFETY: the contract of the caller.
        let sums: [f64; N] = unsafe { self.get(plane, slot) };
        let sums = std::array::from_fn(|lane| sums[lane] + parts[lane]);
        // SAFETY: the contract of the caller.
        unsafe { self.set::<N>(plane, slot, sums) };
    }

    /// Takes the sums of `N` slots and leaves zeros.
    ///
    /// # Safety
    /// No other thread accesses sums of these slots at the same time.
    #[inline(always)]
    pub(super) unsafe fn take<const N: usize>(&self, plane: usize, slot: usize) -> [f64; N] {
        // SAFETY: the contract of the caller.
        let sums = unsafe { self.get(plane, slot) };
        // SAFETY: the contract of the caller.
        unsafe { self.set(plane, slot, [0.0; N]) };
        sums
    }
}
