use epsplat::{scene::*, render::*, gpu::*, frame::Frame};
use glam::*;
fn sphere(n: usize) -> Scene {
    let spacing = (4.0*std::f64::consts::PI/n as f64).sqrt();
    let mut surfels=vec![]; let mut c=vec![];
    for i in 0..n { let z = 1.0-(2.0*i as f64+1.0)/n as f64; let r=(1.0-z*z).sqrt(); let a = (i as f64*0.618033988749895).fract()*std::f64::consts::TAU;
        let p=DVec3::new(r*a.cos(), r*a.sin(), z).as_vec3();
        surfels.push(Surfel::disk(p,p,(1.5*spacing) as f32));
        c.push([(127.0+127.0*(p.x*20.0).sin()) as u8,(127.0+127.0*(p.y*33.0).sin()) as u8,(127.0+127.0*(p.z*50.0).sin()) as u8,255]);
    }
    Scene{origin:DVec3::ZERO,surfels,colors:Colors::Srgb8(c),up:Up::Y}
}
fn diff(a:&Frame,b:&Frame) {
    let mut max=0f32; let mut maxok=0f32; let mut bad=0; let mut excused=0; let mut cov=0; let mut dmax=0f32; let mut nmax=0f32; let mut worst=0f32;
    let dec=b.decision.as_ref().unwrap();
    let mut hist=vec![0;8];
    for i in 0..a.color.len() {
        let d=(0..4).map(|k|(a.color[i][k]-b.color[i][k]).abs()).fold(0f32,f32::max);
        max=max.max(d);
        if (a.color[i][3]>0.0)!=(b.color[i][3]>0.0) {cov+=1;}
        if dec[i]<1e-6 {excused+=1} else { maxok=maxok.max(d); if d>1e-4 {bad+=1; worst=worst.max(dec[i]); hist[(-dec[i].log10()).clamp(0.0,7.0) as usize]+=1;}
          let (da,db)=(a.depth.as_ref().unwrap()[i],b.depth.as_ref().unwrap()[i]); if db.is_finite(){dmax=dmax.max((da-db).abs()/db);}
          let (na,nb)=(a.normal.as_ref().unwrap()[i],b.normal.as_ref().unwrap()[i]); for k in 0..3 {nmax=nmax.max((na[k]-nb[k]).abs());} }
    }
    println!("max {max:e} unexcused {maxok:e} bad {bad} (worst margin {worst:e}, hist {hist:?}) excused {excused}/{} cov {cov} depthrel {dmax:e} normal {nmax:e}", a.color.len());
}
#[test]
fn run() {
    let gpu=Gpu::open(None).unwrap(); println!("{:?}",gpu.adapter);
    let backend=Backend::gpu(gpu);
    for n in [1000usize,100_000,1_000_000] { for ortho in [false,true] {
        let s=sphere(n);
        let lens = if ortho {Lens::OrthographicHeight(2.1)} else {Lens::Fov(45.0)};
        let cam=Camera::look_at((1024,1024),lens,DVec3::new(1.2,0.7,2.4),DVec3::ZERO,None,Up::Y,1e-5).unwrap();
        let mut o=RenderOptions::default(); o.maps.depth=true;o.maps.normal=true;
        let t=std::time::Instant::now();
        let (f,r)=render(&s,&cam,&o,&backend,&()).unwrap();
        println!("gpu {:?} {:?}",t.elapsed(),r);
        let (f2,r2)=render(&s,&cam,&o,&backend,&()).unwrap();
        assert!(f==f2); println!("again {:?} {}",r2.passes,r2.total_ms);
        let plain=RenderOptions{shading:Shading::Unlit,..Default::default()};
        let (_,r2)=render(&s,&cam,&plain,&backend,&()).unwrap(); println!("unlit {:?} {}",r2.passes,r2.total_ms);
        o.maps.decision=true;
        let t=std::time::Instant::now();
        let (g,r)=render(&s,&cam,&o,&Backend::Reference,&()).unwrap();
        println!("ref {:?} {:?} drawn {}",t.elapsed(),r.passes,r.splats_drawn);
        diff(&f,&g);
    }}
}
