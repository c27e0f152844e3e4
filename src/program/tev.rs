//! A running render in the image viewer tev (T. Müller, <https://github.com/Tom94/tev>), over its protocol on TCP.

use std::{
    io,
    net::{TcpStream, ToSocketAddrs},
    time::{Duration, Instant},
};
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};
use translucent::Image;

const CHANNELS: [&str; 4] = ["R", "G", "B", "A"];

/// Least time between two updates, and how long the viewer may keep us waiting.
const PAUSE: Duration = Duration::from_secs(1);
const PATIENCE: Duration = Duration::from_secs(5);

/// Updates take at most this share of the time.
const SHARE: u32 = 10;

/// Most pixels of a packet, whose length is a number of 32 bits.
const PIXELS: u32 = 1 << 20;

/// A viewer that shows one image.
pub struct Viewer {
    client: TevClient,
    name: String,
    /// The image is there.
    created: bool,
    /// When it is shown again.
    due: Instant,
}

impl Viewer {
    /// The viewer that listens at `address` (HOST:PORT); `name` is what it calls the image.
    pub fn connect(address: &str, name: String) -> io::Result<Viewer> {
        let mut error = io::Error::new(io::ErrorKind::NotFound, "the host has no address");
        for address in address.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, PATIENCE) {
                Ok(socket) => {
                    socket.set_write_timeout(Some(PATIENCE))?;
                    return Ok(Viewer { client: TevClient::wrap(socket), name, created: false, due: Instant::now() });
                }
                Err(refused) => error = refused,
            }
        }
        Err(error)
    }

    pub fn is_due(&self) -> bool {
        Instant::now() >= self.due
    }

    /// Shows `image` in place of what was shown before. `since` is when it was begun to be made.
    pub fn show(&mut self, image: &Image, since: Instant) -> io::Result<()> {
        let (name, width) = (&*self.name, image.width);
        if !self.created {
            let height = image.height;
            let image =
                PacketCreateImage { image_name: name, grab_focus: true, width, height, channel_names: &CHANNELS };
            self.client.send(image)?;
            self.created = true;
        }
        let rows = (PIXELS / width).max(1);
        for y in (0..image.height).step_by(rows as usize) {
            let height = rows.min(image.height - y);
            let (begin, count) = (y as usize * width as usize, height as usize * width as usize);
            let channel = |name| image.channel(name).map_or(&[][..], |values| &values[begin..begin + count]);
            self.client.send(PacketUpdateImage {
                image_name: name,
                grab_focus: false,
                channel_names: &CHANNELS,
                channel_offsets: &[0, 1, 2, 3].map(|k| k * count as u64),
                channel_strides: &[1; 4],
                x: 0,
                y,
                width,
                height,
                data: &CHANNELS.map(channel).concat(),
            })?;
        }
        self.due = Instant::now() + PAUSE.max(since.elapsed() * SHARE);
        Ok(())
    }
}
