//! `--tev`: what a viewer is sent, and that none is needed.

use crate::{Folder, stderr};
use std::{
    io::Read,
    net::{TcpListener, TcpStream},
    thread,
};

/// What a packet says after its length.
#[derive(Debug, PartialEq)]
enum Packet {
    Create { name: String, size: [u32; 2], channels: Vec<String> },
    Update { name: String, window: [u32; 4], channels: Vec<String>, values: Vec<Vec<f32>> },
}

/// Reads by the documentation of tev's `Ipc.h`: little-endian numbers, strings that end in 0.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (first, rest) = self.0.split_first_chunk().expect("a packet as long as it says");
        self.0 = rest;
        *first
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|&byte| byte == 0).expect("the end of a string");
        let text = std::str::from_utf8(&self.0[..end]).expect("UTF-8").into();
        self.0 = &self.0[end + 1..];
        text
    }

    fn channels(&mut self) -> Vec<String> {
        (0..self.u32()).map(|_| self.text()).collect()
    }

    fn packet(mut self) -> Packet {
        let [kind, _focus] = self.take();
        let name = self.text();
        let packet = match kind {
            4 => Packet::Create { name, size: [self.u32(), self.u32()], channels: self.channels() },
            6 => {
                let channels = self.channels();
                let window: [u32; 4] = std::array::from_fn(|_| self.u32());
                let mut numbers = || -> Vec<u64> { channels.iter().map(|_| u64::from_le_bytes(self.take())).collect() };
                let (offsets, strides) = (numbers(), numbers());
                let data: Vec<f32> = (0..self.0.len() / 4).map(|_| f32::from_le_bytes(self.take())).collect();
                let value = |k: usize, i: u32| data[(offsets[k] + strides[k] * u64::from(i)) as usize];
                let pixels = window[2] * window[3];
                let values = (0..channels.len()).map(|k| (0..pixels).map(|i| value(k, i)).collect()).collect();
                Packet::Update { name, window, channels, values }
            }
            other => panic!("a packet of kind {other}"),
        };
        assert!(self.0.is_empty(), "{} bytes too many", self.0.len());
        packet
    }
}

fn packets(mut stream: TcpStream) -> Vec<Packet> {
    let mut bytes = vec![];
    stream.read_to_end(&mut bytes).expect("the program sends until it ends");
    let mut rest = &bytes[..];
    let mut packets = vec![];
    while !rest.is_empty() {
        let length = Reader(rest).u32() as usize;
        packets.push(Reader(&rest[4..length]).packet());
        rest = &rest[length..];
    }
    packets
}

#[test]
fn a_viewer_is_sent_the_image_as_it_is_written() {
    let folder = Folder::new("tev");
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let port = listener.local_addr().expect("an address").port();
    let viewer = thread::spawn(move || packets(listener.accept().expect("the program connects").0));
    let words = "render SPOT --resolution 40x30 --crop 4,5,36,29 --samples 64 --quiet";
    folder.done(&format!("{words} --tev 127.0.0.1:{port} -o shown.exr"));
    folder.done(&format!("{words} -o alone.exr"));

    let packets = viewer.join().expect("packets that can be read");
    let channels: Vec<String> = ["R", "G", "B", "A"].map(String::from).into();
    let create = Packet::Create { name: "shown.exr".into(), size: [32, 24], channels: channels.clone() };
    assert_eq!(packets[0], create);
    // After the first submission, and at the end.
    assert!(packets.len() >= 3, "{} packets", packets.len());
    let image = folder.image("shown.exr");
    let values = channels.iter().map(|name| image.channel(name).expect("contract").to_vec()).collect();
    let update = Packet::Update { name: "shown.exr".into(), window: [0, 0, 32, 24], channels, values };
    assert!(packets.last() == Some(&update));
    assert!(packets[1..].iter().all(|packet| matches!(packet, Packet::Update { .. })));
    // That it was shown changes no sample.
    assert!(image.channels == folder.image("alone.exr").channels);
}

#[test]
fn a_render_needs_no_viewer() {
    let folder = Folder::new("no-tev");
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let port = listener.local_addr().expect("an address").port();
    let words = format!("render SPOT --resolution 40x30 --samples 8 --tev 127.0.0.1:{port}");
    // It goes away before it has read anything.
    let viewer = thread::spawn(move || drop(listener.accept().expect("the program connects")));
    assert_eq!(folder.run(&words).status.code(), Some(0));
    viewer.join().expect("it ends");
    // Nobody listens any more.
    let output = folder.run(&words);
    assert_eq!(output.status.code(), Some(0));
    assert!(stderr(&output).contains("warning: no tev at"), "{}", stderr(&output));
}
