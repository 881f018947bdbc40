use super::*;
use std::fs;

fn store(limit_bytes: u64) -> (tempfile::TempDir, Store) {
    let t = tempfile::tempdir().unwrap();
    let store = Store::new(&t.path().join("store"), limit_bytes);
    (t, store)
}

fn got(store: &Store, kind: &str, key: Key) -> Option<Vec<u8>> {
    store.get(kind, key, Payload::rest)
}

#[test]
fn what_was_put_comes_back() {
    let (_t, store) = store(1 << 20);
    assert_eq!((got(&store, "a", Key(1)), store.stat()), (None, Stat::default()));
    store.put("a", Key(1), &[b"one", b"", b" two"]);
    assert_eq!(got(&store, "a", Key(1)).unwrap(), b"one two");
    // another kind, another key
    assert_eq!((got(&store, "b", Key(1)), got(&store, "a", Key(2))), (None, None));
    store.put("a", Key(1), &[b"three"]);
    assert_eq!(got(&store, "a", Key(1)).unwrap(), b"three");
    // a head of 56 bytes
    assert_eq!(store.stat(), Stat { entries: 1, bytes: 56 + 5 });
    assert!(store.take_notes().is_empty());
}

#[test]
fn lists_come_back_in_pieces() {
    let (_t, store) = store(1 << 22);
    let long: Vec<u32> = (0..100_000).collect();
    store.put("a", Key(1), &[bytemuck::cast_slice(&long), b"end"]);
    let taken = store.get("a", Key(1), |payload| {
        assert_eq!(payload.values::<u32>(usize::MAX), None);
        assert_eq!(payload.values::<u32>(100_001), None);
        assert_eq!(payload.rest::<u32>(), None, "3 bytes too many");
        Some((payload.values::<[u32; 2]>(50_000)?, payload.left()))
    });
    let (values, left) = taken.unwrap();
    assert!(values.as_flattened() == long && left == 3);
    // what is left or refused is looked at all the same
    let path = store.path("a", Key(1));
    let mut bytes = fs::read(&path).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(path, bytes).unwrap();
    assert_eq!(store.get("a", Key(1), |_| Some(())), None);
    assert_eq!(store.take_notes().len(), 1);
}

/// What befalls an entry; the other one is whole.
type Damage = dyn Fn(&Path, &Path);

#[test]
fn damage_is_told_and_given_up() {
    let (_t, store) = store(1 << 20);
    let content = b"a payload of some length".as_slice();
    let damage: [&Damage; 4] = [
        &|path, _| {
            let mut bytes = fs::read(path).unwrap();
            let middle = bytes.len() / 2;
            bytes[middle] ^= 1;
            fs::write(path, bytes).unwrap();
        },
        &|path, _| fs::write(path, &fs::read(path).unwrap()[..60]).unwrap(),
        &|path, _| fs::write(path, "").unwrap(),
        &|path, other| assert!(fs::copy(other, path).unwrap() > 0),
    ];
    for damage in damage {
        store.put("a", Key(1), &[content]);
        store.put("a", Key(2), &[content]);
        damage(&store.path("a", Key(1)), &store.path("a", Key(2)));
        assert_eq!(got(&store, "a", Key(1)), None);
        let notes = store.take_notes();
        assert!(notes.len() == 1 && notes[0].contains("damaged"), "{notes:?}");
        assert!(!store.path("a", Key(1)).exists());
        assert_eq!(got(&store, "a", Key(2)).unwrap(), content);
    }
    // every bit of an entry counts
    store.put("a", Key(1), &[b"xy"]);
    let path = store.path("a", Key(1));
    let whole = fs::read(&path).unwrap();
    for bit in 0..8 * whole.len() {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        fs::write(&path, bytes).unwrap();
        assert_eq!(got(&store, "a", Key(1)), None, "bit {bit}");
    }
}

#[test]
fn the_longest_unused_goes_first() {
    let (_t, store) = store(56 * 2 + 20);
    for (i, key) in [1, 2, 3].into_iter().enumerate() {
        store.put("a", Key(key), &[&[7; 10]]);
        let time = std::time::UNIX_EPOCH + std::time::Duration::from_secs(1_000_000 + i as u64);
        fs::File::open(store.path("a", Key(key))).unwrap().set_modified(time).unwrap();
    }
    // the first is used again
    assert!(got(&store, "a", Key(1)).is_some());
    assert_eq!(store.collect_garbage().gone, Stat { entries: 1, bytes: 66 });
    assert_eq!([1, 2, 3].map(|key| got(&store, "a", Key(key)).is_some()), [true, false, true]);
    assert_eq!(store.clear().gone.entries, 2);
    assert_eq!(store.stat().entries, 0);
}

#[test]
fn a_store_that_cannot_be_written_is_told_of_once() {
    let t = tempfile::tempdir().unwrap();
    let file = t.path().join("file");
    fs::write(&file, "").unwrap();
    let store = Store::new(&file, 1 << 20);
    store.put("a", Key(1), &[b"one"]);
    store.put("a", Key(2), &[b"two"]);
    assert_eq!(got(&store, "a", Key(1)), None);
    let notes = store.take_notes();
    assert!(notes.len() == 1 && notes[0].contains("--no-cache"), "{notes:?}");
}
