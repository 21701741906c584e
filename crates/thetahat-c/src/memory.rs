//! What stands in the memory of an object, and how pointers of C are followed.

use core::mem::{align_of, size_of};
use core::slice;

use crate::{Error, Number};

/// A word of the memory that an object is given: so it is aligned for whatever stands in it.
pub type Word = u64;

/// A kind of object: what its handle stands for.
pub(crate) trait Kind {
    /// Stands in the memory of every object of this kind, and hardly elsewhere.
    const TAG: u32;
    /// What is exported for each size.
    type Size: 'static + Sync;
    /// What can be done with an object of any size.
    type Body: ?Sized;

    /// How objects of this size are seen.
    fn view(size: &Self::Size) -> View<Self::Body>;
}

/// The handle of an object that was made, or why it was not.
pub(crate) type Made<K> = Result<*mut K, Error>;

/// Makes a filter or observer in its place from a state, and from a matrix that may be missing.
pub(crate) type Init<K> = fn(Place<K>, &[Number], Option<&[Number]>) -> Made<K>;

/// Makes of the place of a body what can be done with it.
pub(crate) type View<B> = fn(*mut u8) -> *mut B;

/// Takes the place of a tag while a function of the user runs.
const BUSY: u32 = 0x5942_5354;

/// What every object begins with. Its body follows at the next word.
#[repr(C)]
struct Head<S: 'static> {
    tag: u32,
    size: &'static S,
}

/// Where the body begins.
const BODY: usize = size_of::<Head<u8>>().next_multiple_of(size_of::<Word>());

/// Memory for an object of kind `K` and one size.
pub(crate) struct Place<K: Kind> {
    memory: *mut u8,
    bytes: usize,
    size: &'static K::Size,
}

impl<K: Kind> Place<K> {
    /// The memory that an init function is given, checked.
    ///
    /// # Safety
    ///
    /// Each pointer is null or valid, and nothing else uses the memory.
    pub(crate) unsafe fn new(memory: *mut Word, bytes: usize, size: *const K::Size) -> Result<Self, Error> {
        // What is exported is constant, and lives for ever.
        let size = &*follow(size)?;
        let memory: *const Word = follow(memory)?;
        Ok(Place { memory: memory.cast_mut().cast(), bytes, size })
    }

    /// The size of the object.
    pub(crate) fn size(&self) -> &'static K::Size {
        self.size
    }

    /// Writes a body: then it is an object.
    pub(crate) fn write<B>(self, body: B) -> Made<K> {
        const { assert!(align_of::<B>() <= align_of::<Word>()) };
        if self.bytes < BODY + size_of::<B>() {
            return Err(Error::MemoryTooSmall);
        }
        // SAFETY: `new` had a valid pointer, aligned for words, to as many bytes, which the object now owns.
        unsafe {
            self.memory.add(BODY).cast::<B>().write(body);
            self.memory.cast::<Head<K::Size>>().write(Head { tag: K::TAG, size: self.size });
        }
        Ok(self.memory.cast())
    }
}

/// The body of an object, to be changed.
///
/// # Safety
///
/// The pointer is null or valid, and nothing else uses the object in the meantime.
pub(crate) unsafe fn open<'a, K: Kind>(object: *mut K) -> Result<&'a mut K::Body, Error> {
    Ok(&mut *body(object)?)
}

/// The body of an object, to be read.
///
/// # Safety
///
/// The pointer is null or valid, and nothing changes the object in the meantime.
pub(crate) unsafe fn read<'a, K: Kind>(object: *const K) -> Result<&'a K::Body, Error> {
    Ok(&*body(object.cast_mut())?)
}

/// Where the body of an object is.
unsafe fn body<K: Kind>(object: *mut K) -> Result<*mut K::Body, Error> {
    let head: *const Head<K::Size> = follow(object.cast::<Word>())?.cast();
    match (&raw const (*head).tag).read() {
        tag if tag == K::TAG => Ok(K::view((*head).size)(object.cast::<u8>().add(BODY))),
        BUSY => Err(Error::Busy),
        _ => Err(Error::NotInitialised),
    }
}

/// Runs `work`, which calls functions of the user: any that calls back with the same object gets an error.
///
/// # Safety
///
/// The pointer is null or valid, and nothing else uses the object in the meantime.
pub(crate) unsafe fn busy<K: Kind>(
    object: *mut K,
    work: impl FnOnce(&mut K::Body) -> Result<(), Error>,
) -> Result<(), Error> {
    let body = body(object)?;
    let tag = object.cast::<u32>();
    tag.write(BUSY);
    let result = work(&mut *body);
    tag.write(K::TAG);
    result
}

/// The pointer, if it is neither null nor misaligned.
pub(crate) fn follow<T>(pointer: *const T) -> Result<*const T, Error> {
    if pointer.is_null() {
        return Err(Error::NullPointer);
    }
    if !pointer.is_aligned() {
        return Err(Error::Misaligned);
    }
    Ok(pointer)
}

/// So many values of an array.
///
/// # Safety
///
/// The pointer is null, or valid for so many values, which nothing changes in the meantime.
pub(crate) unsafe fn array<'a, T>(values: *const T, count: usize) -> Result<&'a [T], Error> {
    if count == 0 { Ok(&[]) } else { Ok(slice::from_raw_parts(follow(values)?, possible::<T>(count)?)) }
}

/// The count, if so many values fit into the address space.
fn possible<T>(count: usize) -> Result<usize, Error> {
    let most = isize::MAX as usize / size_of::<T>().max(1);
    if count <= most { Ok(count) } else { Err(Error::Length) }
}

/// So many values of an array, or none if there is no array.
///
/// # Safety
///
/// As for [`array`].
pub(crate) unsafe fn optional<'a, T>(values: *const T, count: usize) -> Result<Option<&'a [T]>, Error> {
    if values.is_null() { Ok(None) } else { array(values, count).map(Some) }
}

/// So many values of an array, to be written.
///
/// # Safety
///
/// As for [`array`], and nothing else reads them in the meantime.
pub(crate) unsafe fn array_mut<'a, T>(values: *mut T, count: usize) -> Result<&'a mut [T], Error> {
    if count == 0 {
        return Ok(&mut []);
    }
    Ok(slice::from_raw_parts_mut(follow(values)?.cast_mut(), possible::<T>(count)?))
}

/// Writes an answer, if there is a place for it.
///
/// # Safety
///
/// The pointer is null or valid.
pub(crate) unsafe fn answer<T>(place: *mut T, value: T) {
    if !place.is_null() {
        place.write_unaligned(value);
    }
}
