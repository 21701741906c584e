//! How the firmware is linked. (Here and not in `.cargo/config.toml`, where RUSTFLAGS would override it.)

fn main() {
    println!("cargo::rerun-if-changed=firmware/link.x");
    for image in ["bare", "report", "alone-kalman", "alone-least-squares", "alone-arx"] {
        println!("cargo::rustc-link-arg-bin={image}=-Tfirmware/link.x");
    }
    for image in ["bare", "report"] {
        // Relocations stay in the image: they say which function refers to which.
        println!("cargo::rustc-link-arg-bin={image}=--emit-relocs");
    }
}
